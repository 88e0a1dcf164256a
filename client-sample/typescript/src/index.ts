export * from './client.js';
export * from './columns.js';
export * from './frame.js';
export * from './messages.js';
export * from './transport.js';
export * from './voxel.js';
export * from './want_set.js';
export { decode, type Failure, type Incoming, type RequestOptions } from './codec.js';
