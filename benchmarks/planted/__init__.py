"""Effects planted in recordings of real machines, and whether `explain` names them beside what it names without."""
