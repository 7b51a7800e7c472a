"""Time steppers: one short file a method, all behind `interfaces.Stepper`."""
