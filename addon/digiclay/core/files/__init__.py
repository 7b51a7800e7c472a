"""Files: folders of runs, locks, tables, arrays and pictures, complete under their name or absent."""
