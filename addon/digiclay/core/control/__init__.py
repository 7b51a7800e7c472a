"""Control methods: from measurements to valve commands."""
