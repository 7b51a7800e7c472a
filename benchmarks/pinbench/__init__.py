"""PinBench: problems that name no engine, adapters of engines, and references."""
