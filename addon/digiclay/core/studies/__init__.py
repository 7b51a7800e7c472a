"""Series of sessions: sweeps, batches of jobs, budgets, trials."""
