"""Commands of the command line, one file each: arguments, call of the core, output."""
