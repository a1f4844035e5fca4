"""What things cost, each beside its yardstick in the same run. The command is `eval.bench`."""
