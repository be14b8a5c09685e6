"""Houses and town buildings."""
