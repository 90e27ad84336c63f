"""Pictures and films of the deforming specimen between its platens, made without a window."""
