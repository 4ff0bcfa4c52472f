"""One mesh whose pairs of teeth touch one by one: linear between events, a flank line for each."""
