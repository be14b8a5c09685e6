"""Traffic that others recorded, or planned, as actors: SUMO, ASAM OSI, CommonRoad, nuScenes."""
