"""What is asked of foreign MainDevices and cannot be tried with them, and why."""

SKIPPED = [
    ("ethercrab", "a ring that breaks", "version 0.7 drives one interface"),
    ("ethercrab", "downloads of more than four bytes", "version 0.7 sends expedited ones only"),
    ("ethercrab", "uploads in segments", "version 0.7 takes the command specifier of their answers, 0, for an error"),
    ("ethercrab", "a SubDevice brought back", "version 0.7 has no way to take one SubDevice up again"),
    ("kickcat", "identities", "its Python interface tells no vendor, product or revision"),
    ("kickcat", "SII read and write, alias", "its Python interface has no SII access"),
    ("kickcat", "distributed clocks", "its Python interface has none"),
    ("kickcat", "uploads in segments", "version 2.5 takes the first four bytes of each segment for its length"),
    ("kickcat", "downloads in segments", "version 2.5 refuses to send them: not implemented"),
    ("kickcat", "abort codes", "version 2.5 drops messages of the service of requests, by which SubDevices abort"),
    ("kickcat", "a SubDevice brought back", "its Python interface has no state of one SubDevice"),
    ("ebpfcat", "a ring that breaks", "version 1.0 drives one interface"),
    ("ebpfcat", "distributed clocks", "version 1.0 has none"),
    ("ebpfcat", "a SubDevice brought back", "version 1.0 restores no state"),
]
