"""Effects of a real front end on the raw data, a module an effect; `chain` has their order."""
