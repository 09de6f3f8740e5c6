"""What a metric is: a function of recorded signals."""
