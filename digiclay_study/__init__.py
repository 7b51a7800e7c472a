"""Sensitivity and tuning of parameters: ``digiclay study`` and ``digiclay tune``, with SALib and optuna."""
