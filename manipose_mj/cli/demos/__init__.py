"""`manipose demos`: record demonstrations, replay and export them."""
