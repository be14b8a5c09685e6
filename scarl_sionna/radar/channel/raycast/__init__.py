"""SCaRL's own channel: a fixed grid of rays, each hit one point target."""
