"""Control methods of one's own: their code is found, loaded, checked and shipped."""
