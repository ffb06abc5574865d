"""Many runs as one: cases of a study, the processes that run them, what is kept of them."""
