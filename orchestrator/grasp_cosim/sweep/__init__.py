"""Many runs of one system: designs, parallel and resumable runs, what they say together."""
