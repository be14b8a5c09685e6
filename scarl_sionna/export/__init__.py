"""Writers and readers of datasets, and pictures of frames."""

from .encoding import StoreOptions
from .folder import FrameFolderWriter, frame_folders, read_frame
from .reader import Dataset, Scene, StoredFrame, open_dataset
from .writer import write_dataset

__all__ = [
    "Dataset",
    "FrameFolderWriter",
    "Scene",
    "StoreOptions",
    "StoredFrame",
    "frame_folders",
    "open_dataset",
    "read_frame",
    "write_dataset",
]
