"""Where a run is not smooth: jumps of the text, events, what holds behind them."""
