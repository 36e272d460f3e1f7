"""The words of a trace: operations so far, the most that fit, and how many arguments there are;
behind them the two numbers of each operation, -1 for a constant. See `traced_numbers`."""

COUNT, ROOM, ARGUMENTS, FIRST = 0, 1, 2, 3
