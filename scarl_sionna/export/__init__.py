"""Writers and readers of frames, and pictures of them."""

from .folder import FrameFolderWriter, frame_folders, read_frame

__all__ = ["FrameFolderWriter", "frame_folders", "read_frame"]
