"""What a person at a prompt meets: how objects show themselves, plots, and errors that say what was meant."""
