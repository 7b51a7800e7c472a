"""Controllers: strategies that turn measurements into valve commands."""
