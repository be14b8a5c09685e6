"""Maps of a radar without raw data: paths put onto its grid with what a point looks like there."""
