"""The recording of the last minute, written to a file at every stop: recorder, people, file format, reader, and the codec of the types of the law."""
