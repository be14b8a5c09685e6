"""Exports of any size: scenarios become a dataset, in this process, in several, or on a cluster.

Stopped and resumed at will.
"""

from .driver import ExportSettings, export
from .estimate import Estimate, estimate
from .job import ShardReport
from .report import ExportReport
from .stop import ExportStopped
from .sweep import Sweep

__all__ = ["Estimate", "ExportReport", "ExportSettings", "ExportStopped", "ShardReport", "Sweep", "estimate", "export"]
