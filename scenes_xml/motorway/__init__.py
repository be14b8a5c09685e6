"""A motorway with a median barrier, guardrails, a bridge over it, a sign gantry and a noise wall."""
