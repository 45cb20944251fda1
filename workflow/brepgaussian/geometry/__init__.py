"""Mathematics shared by several stages: cameras, surfaces, fitting. No files, no settings."""
