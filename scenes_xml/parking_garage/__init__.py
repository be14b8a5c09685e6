"""An underground car park: columns, beams, ducts, ramps, parked cars and people on foot."""
