"""Camera geometry that several services share: pure, of numbers and arrays only."""
