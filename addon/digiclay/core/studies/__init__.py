"""Series of sessions: sweeps, job series, budgets, trials."""
