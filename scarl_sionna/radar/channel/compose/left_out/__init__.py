"""What a solve of ``method="auto"`` does not compute, and how much power that can hold."""
