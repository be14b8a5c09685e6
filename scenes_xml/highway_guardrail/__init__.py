"""A bend with a guardrail, after the situation of Figure 2 of the SCaRL paper."""
