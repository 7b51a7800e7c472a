"""Base of all other packages of the core: errors, quantities, cell modes, arrays."""
