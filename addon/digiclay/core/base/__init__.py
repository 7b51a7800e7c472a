"""What every other package of the core stands on: errors, quantities, cell modes, files."""
