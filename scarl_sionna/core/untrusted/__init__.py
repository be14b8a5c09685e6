"""Reading of files that nobody vouches for: bounded in size, depth and time, and turned into checked data at once.

Every reader of a user's file goes through here. A file that is too large, no regular file, nested too deeply or not of
its format is an :class:`scarl_sionna.core.errors.InputFileError` or the reader's own typed error.
"""
