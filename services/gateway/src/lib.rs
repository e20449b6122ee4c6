//! The gateway: REST, WebSocket, recordings, metrics and the operator's console.
