"""From points to objects: clusters of one frame, tracks over frames."""

from .clusters import RadarClusters, cluster
from .tracker import track
from .tracks import RadarTracks

__all__ = ["RadarClusters", "RadarTracks", "cluster", "track"]
