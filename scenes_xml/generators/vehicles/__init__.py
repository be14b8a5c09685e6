"""Cars, vans, lorries, buses and two-wheelers, and their parts."""
