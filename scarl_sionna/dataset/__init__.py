"""Writers and readers of datasets, and pictures of frames."""

from .encoding import StoreOptions
from .readers.reader import Dataset, Scene, StoredFrame, open_dataset
from .store.writer import write_dataset

__all__ = [
    "Dataset",
    "Scene",
    "StoreOptions",
    "StoredFrame",
    "open_dataset",
    "write_dataset",
]
