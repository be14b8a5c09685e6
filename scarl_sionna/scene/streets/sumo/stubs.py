"""Edges too short to be roads, as netconvert leaves them between junctions that overlap: ways pass over them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model import Finding
from .net import Net, NetEdge, NetLink

SHORTEST = 2.0
"""An edge with a shorter lane is passed over [m]."""
LONGEST = 40.0
"""Largest distance of a way that passes over such edges [m]."""


def without_stubs(net: Net) -> Net:
    """Return a network without edges that are too short: each way to one goes on to where its lane leads.

    Lights that stop the end of such an edge stop the one before it.
    """
    stubs = [edge for edge in net.edges.values() if _length(edge) < SHORTEST]
    if not stubs or len(stubs) == len(net.edges):
        return net
    links = list(net.links)
    for stub in stubs:
        into = [link for link in links if link.target == stub.id and link.source in net.edges]
        out = [link for link in links if link.source == stub.id and link.target in net.edges]
        links = [link for link in links if stub.id not in (link.source, link.target)]
        links += [
            replace(first, target=last.target, to_lane=last.to_lane, via="", light=first.light or last.light)
            for first in into
            for last in out
            if last.from_lane == first.to_lane and last.target != first.source and _is_near(net, first, last)
        ]
    gone = {stub.id for stub in stubs}
    edges = {name: edge for name, edge in net.edges.items() if name not in gone}
    found = [Finding(stub.line, f"an edge of less than {SHORTEST:g} m is passed over") for stub in stubs]
    return replace(net, edges=edges, links=_distinct(links), findings=(*net.findings, *found))


def _length(edge: NetEdge) -> float:
    return min(float(np.linalg.norm(np.diff(lane.shape[:, :2], axis=0), axis=1).sum()) for lane in edge.lanes)


def _is_near(net: Net, first: NetLink, last: NetLink) -> bool:
    """Return whether a way over a short edge is one through a crossing: not long, and not back."""
    start = net.edges[first.source].lanes[first.from_lane].shape[-2:, :2]
    stop = net.edges[last.target].lanes[last.to_lane].shape[:2, :2]
    one, other = start[1] - start[0], stop[1] - stop[0]
    is_back = one @ other < -0.8 * np.linalg.norm(one) * np.linalg.norm(other)
    return bool(np.linalg.norm(stop[0] - start[1]) < LONGEST and not is_back)


def _distinct(links: list[NetLink]) -> tuple[NetLink, ...]:
    """Return links without those that join the same lanes as one before."""
    found: dict[tuple[str, int, str, int], NetLink] = {}
    for link in links:
        found.setdefault((link.source, link.from_lane, link.target, link.to_lane), link)
    return tuple(found.values())
