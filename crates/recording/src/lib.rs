//! Recordings with SI columns: read, write, map foreign logs.
