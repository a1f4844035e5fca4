"""Policies in the forms that others run: ONNX, and a folder as the Hugging Face Hub has them."""
