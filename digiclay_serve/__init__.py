"""Sessions for other programs: poses in, forces and heights out, by WebSocket, OSC and serial line."""
