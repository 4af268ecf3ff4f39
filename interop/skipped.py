"""What is asked of foreign MainDevices and cannot be tried with them, and why."""

SKIPPED = [
    ("ethercrab", "a ring that breaks", "version 0.7 drives one interface"),
    ("kickcat", "identities", "its Python interface tells no vendor, product or revision"),
    ("kickcat", "SII read and write, alias", "its Python interface has no SII access"),
    ("kickcat", "SDO download", "its Python interface reads objects only"),
]
