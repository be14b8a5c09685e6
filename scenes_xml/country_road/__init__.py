"""A country road over low hills, with ditches, fields, a farm and a guardrail in one bend."""
