"""Sessions for other programs: poses in, forces and heights out, by WebSocket and OSC."""
