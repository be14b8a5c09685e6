"""A residential street with detached houses, gardens, street trees and parked cars."""
