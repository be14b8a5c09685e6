"""How a sensor is simulated, as plain frozen data: methods, tolerances, budgets and the knobs of each solver."""
