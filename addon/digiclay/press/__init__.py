"""Press tool: the fingertip under the mouse."""
