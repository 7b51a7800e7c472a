"""The commands of the command line, one file each: arguments in, core called, outcome shown."""
