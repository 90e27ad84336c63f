"""Several shots of one material, and slow tests beside them, identified together."""
