"""Writers and readers of datasets, and pictures of frames."""

from .encoding import StoreOptions
from .reader import Dataset, Scene, StoredFrame, open_dataset
from .writer import write_dataset

__all__ = [
    "Dataset",
    "Scene",
    "StoreOptions",
    "StoredFrame",
    "open_dataset",
    "write_dataset",
]
