"""The recording of the last minute, written to a file at every stop: recorder, file format, reader, and the codec of the types of the law."""
