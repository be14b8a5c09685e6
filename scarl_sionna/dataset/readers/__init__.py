"""Reading a dataset: lazily, as tables, and for TensorFlow, PyTorch and xarray."""
