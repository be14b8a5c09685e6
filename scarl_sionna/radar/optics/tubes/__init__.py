"""Ray tubes: where they are probed, how they are cut and followed, whatever the wave."""
