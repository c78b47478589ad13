"""What plugins that run ONNX models share: checked model files, sessions on a device, images as input tensors."""
