"""What is read and written: bags, messages, and all files besides."""
