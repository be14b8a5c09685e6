"""The files of a dataset: manifest, shards, locks, and writes that are whole or not there."""
