"""Does the model explain the data: goodness of fit by channel, clocks, and which input is wrong."""
