"""The radar's specification."""
