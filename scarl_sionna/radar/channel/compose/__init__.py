"""Several solvers at once: plans, mirrors, objects through mirrors, and the choice of auto."""
